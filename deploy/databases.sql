-- The databases of docs/team.md, made when PostgreSQL starts for the first time.
\getenv mlflow_password MLFLOW_DATABASE_PASSWORD
\getenv studies_password STUDIES_DATABASE_PASSWORD
CREATE ROLE mlflow LOGIN PASSWORD :'mlflow_password';
CREATE DATABASE mlflow OWNER mlflow;
CREATE DATABASE logins OWNER mlflow;
CREATE ROLE studies LOGIN PASSWORD :'studies_password';
CREATE DATABASE studies OWNER studies;
